"""One process of the ``paper`` recipe at toy width: ``python paper_process.py FILE``.

The file is a JSON list of pairs: a free port where the processes meet, and the command line of one
``diff4splat train``. They run one after another.
"""

import json
import os
import sys
from pathlib import Path

import torch

from diff4splat.cli.main import run


def main(file: Path) -> int:
    torch.set_num_threads(1)
    codes = []
    for port, arguments in json.loads(file.read_text()):
        os.environ["MASTER_PORT"] = str(port)
        codes.append(run(arguments))
    return max(codes)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
