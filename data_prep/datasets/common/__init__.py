"""What all data sets share: sequences, their windows, and clips made of them."""
