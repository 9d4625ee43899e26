"""What other packages find of this one by entry points."""
