"""The stages of the loop, a file each: generate, intersect, surface, absorb, shade, bounce, compact."""
