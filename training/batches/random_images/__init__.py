"""Images as another camera would have taken them: views, skies, photographs without depth."""
