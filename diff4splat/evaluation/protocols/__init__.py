"""Versioned evaluation protocols as JSON; a published one never changes, a better one is new."""
