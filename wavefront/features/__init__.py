"""What few scenes have, a file each: when a scene has it, and where it acts. See compile/program.py."""
