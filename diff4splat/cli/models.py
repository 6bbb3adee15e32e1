"""``diff4splat models``: public weights by name, and downloads of them."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from diff4splat.errors import Diff4SplatError


@dataclass(frozen=True, slots=True, kw_only=True)
class CatalogName:
    """A model that ``models list`` names."""

    def check(self, option: str, value: str) -> None:
        """Refuse other names."""
        from diff4splat.models.registry.catalog import find_model

        del option
        find_model(value)


@dataclass(frozen=True, kw_only=True)
class ListModels:
    """List public depth networks: name, size, licence, source. Nothing is downloaded."""

    def run(self) -> None:
        """Print a table to standard output."""
        from diff4splat.models.registry.catalog import CATALOG, PublicModel

        width = max(len(model.name) for model in CATALOG)

        def row(model: PublicModel) -> str:
            known = all(file.sha256 for file in model.files)
            return (
                f"{model.name:<{width}}  {model.megabytes:>4} MB  {model.license:<13}"
                f"{'known' if known else 'at first use':<13}{state(model):<12}{model.what}"
            )

        head = f"{'name':<{width}}  {'size':>7}  {'licence':<13}{'hash':<13}{'cache':<12}depth"
        print("\n".join((head, *map(row, CATALOG))))
        print("\nSources:")
        print("\n".join(f"{model.name:<{width}}  {model.source}" for model in CATALOG))
        print(
            "\nLicences other than Apache-2.0 and MIT restrict use; `models get` then needs "
            "--accept-license."
        )


def state(model: "object") -> str:
    """Whether a model is in the cache."""
    from diff4splat.models.registry.cache import cached_graph

    try:
        cached_graph(model)
    except Diff4SplatError:
        return "-"
    return "downloaded"


@dataclass(frozen=True, kw_only=True)
class GetModel:
    """Download a public depth network into the cache, and check its hash.

    HTTPS_PROXY and NO_PROXY are followed. DIFF4SPLAT_MIRROR names a folder or an address with
    NAME/FILE below it, DIFF4SPLAT_CACHE another cache.
    """

    name: Annotated[str, tyro.conf.Positional, CatalogName()]
    """Name of the network; `models list` has them."""
    accept_license: bool = False
    """The licence of the weights restricts use, and that is accepted."""

    def check(self) -> None:
        """Refuse restricted weights that nobody accepted."""
        from diff4splat.models.registry.catalog import find_model
        from diff4splat.models.registry.get import require_license

        require_license(find_model(self.name), self.accept_license)

    def run(self) -> None:
        """Download, check, and print where the network is."""
        from diff4splat.cli.common.console import ConsolePhases, note
        from diff4splat.models.registry.catalog import find_model
        from diff4splat.models.registry.get import get_model

        model = find_model(self.name)
        graph = get_model(model, ConsolePhases(), note)
        note(
            f"licence {model.license}; use it with: diff4splat generate PHOTO --depth {model.name}"
        )
        print(graph)
