"""Captions of clips: vocabulary, grammar and parser, mirror images and paraphrases."""
