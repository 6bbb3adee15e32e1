"""A dozen scenes on one page, each with its viewer, its video and what it cost."""
