"""ImageNet's classes by the nouns of prompts."""
