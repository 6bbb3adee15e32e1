"""What sampling settings cost and give."""
