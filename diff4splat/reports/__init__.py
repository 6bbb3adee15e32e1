"""The whole report on one page: error against run time, what runs leave out, stability."""
