"""Scenes fitted through optics, and optics recovered from wrong guesses."""
