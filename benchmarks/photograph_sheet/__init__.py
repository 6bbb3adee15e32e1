"""Twelve photographs at 15 degrees to both sides, as they come out, with their depth.

    python -m benchmarks.photograph_sheet --model small --out sheet.jpg

The photographs come with packages: scikit-image (its README names each source; CC0 and public
domain), Matplotlib (a portrait of the U.S. Navy, public domain), viser (panoramas of Poly Haven,
CC0, of which views are cut). Nothing is trained on them.
"""
