"""Motions that can be learned: which numbers they have, and which ``Motion`` these make."""
