"""Captions that are true: colour names, a grammar, its parser, and counterfactual captions."""
