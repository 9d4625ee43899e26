"""The stages of the loop, such as generate, intersect, shade, bounce and compact, a file each."""
