"""Scenes of Mitsuba 3: XML files, and the dictionaries of `mi.load_dict`."""
