"""Workers: threads, processes and clusters that do jobs, whatever those are, and return results in order."""

__all__ = []
