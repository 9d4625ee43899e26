"""The sums of the samples of a picture, their errors, and the files that keep them."""
