"""The stages of the loop, a file each: generate, intersect, surface, shade, bounce, compact."""
