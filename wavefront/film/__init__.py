"""What the samples of a picture add up to: sums, their errors, and the files that keep them."""
