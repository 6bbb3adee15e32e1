"""Images of another renderer, path-traced by Mitsuba 3: no network is trained on them.

    python -m benchmarks.out_of_domain render --out FOLDER --images 48
    python -m benchmarks.out_of_domain depth --images FOLDER --out depth.md

The procedural worlds share shapes, textures and light with the training data. These scenes do not:
other shapes, scanned textures, global light, gloss, glass, lenses, with and without ground or sky.
"""
