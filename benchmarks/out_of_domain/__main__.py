"""Command line of the out-of-domain images."""

import argparse
from pathlib import Path

from benchmarks.out_of_domain.depth_table import write_depth_table
from benchmarks.out_of_domain.path_views import render_views
from benchmarks.out_of_domain.prior_table import write_prior_picture, write_prior_table
from benchmarks.out_of_domain.rendering import render_images


def main() -> None:
    """Render the images, or evaluate depth on them."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(required=True)
    render = commands.add_parser("render")
    render.add_argument("--out", type=Path, required=True)
    render.add_argument("--images", type=int, default=24)
    render.add_argument("--side", type=int, default=192)
    render.add_argument("--seed", type=int, default=0)
    render.set_defaults(run=render_images)
    views = commands.add_parser("views")
    views.add_argument("--out", type=Path, required=True)
    views.add_argument("--images", type=int, default=24)
    views.add_argument("--side", type=int, default=192)
    views.add_argument("--path", default="spiral")
    views.add_argument("--views", type=int, default=3)
    views.add_argument("--seed", type=int, default=0)
    views.set_defaults(run=render_views)
    priors = commands.add_parser("priors")
    priors.add_argument("--images", type=Path, required=True)
    priors.add_argument("--model", default="small")
    priors.add_argument("--out", type=Path, required=True)
    priors.set_defaults(run=write_prior_table)
    picture = commands.add_parser("picture")
    picture.add_argument("--images", type=Path, required=True)
    picture.add_argument("--model", default="small")
    picture.add_argument("--items", type=int, nargs="+", default=[0, 1])
    picture.add_argument("--out", type=Path, required=True)
    picture.set_defaults(run=write_prior_picture)
    depth = commands.add_parser("depth")
    depth.add_argument("--images", type=Path, required=True)
    depth.add_argument("--model", nargs="+", default=["small"])
    depth.add_argument("--sides", type=int, nargs="+", default=[64, 96, 128])
    depth.add_argument("--out", type=Path, required=True)
    depth.set_defaults(run=write_depth_table)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
