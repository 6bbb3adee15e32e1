"""Import, alignment, captions and scores in tasks, on one machine or many."""
