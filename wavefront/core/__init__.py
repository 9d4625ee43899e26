"""The base of every package: errors, tables of names, files, memory, progress, fingerprints."""
