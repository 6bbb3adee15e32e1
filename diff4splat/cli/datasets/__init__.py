"""Commands about copies of training data sets."""
