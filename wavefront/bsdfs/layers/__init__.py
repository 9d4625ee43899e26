"""The layered BSDF, and the parts that models of materials make it from."""
