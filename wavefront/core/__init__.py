"""What every package uses: errors, tables of names, files, memory, progress, fingerprints."""
