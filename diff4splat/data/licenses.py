"""Which licences allow selling what was learned from a clip.

A list of those that do, by SPDX name (https://spdx.org/licenses); whatever is not on it does not,
so that an unknown name never passes for a free one. This sorts clips; it is no legal advice.
"""

import re

_COMMERCIAL = frozenset(
    {
        "0BSD",
        "APACHE-2.0",
        "BSD-2-CLAUSE",
        "BSD-3-CLAUSE",
        "CC-BY-3.0",
        "CC-BY-4.0",
        "CC-BY-SA-3.0",
        "CC-BY-SA-4.0",
        "CC0-1.0",
        "CDLA-PERMISSIVE-2.0",
        "MIT",
        "MIT-0",
    }
)


def commercial_ok(license_name: str) -> bool:
    """Whether the licence is known to allow commercial use; spaces and case do not matter.

    Of several, joined by ``AND`` as in SPDX expressions, all must.
    """
    names = re.split(r"\s+AND\s+", license_name.strip().upper())
    return all(re.sub(r"[\s_-]+", "-", name) in _COMMERCIAL for name in names)
