"""Arrays: vectors, elementary functions, frames, and the records that the stages pass on."""
