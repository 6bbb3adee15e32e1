"""A worker without networks: what it does follows from the seed of its task.

0 …   a result after a few steps          7   sleeps for ever          8   dies
9     refuses its input                   6   takes memory             5   prints rubbish
"""

import os
import sys
import threading
import time
from pathlib import Path

from diff4splat.serving.workers.protocol import Task, message


def main() -> None:
    print(message(ready=True), end="", flush=True)
    line = sys.stdin.readline()
    if not line:
        return
    threading.Thread(target=lambda: (sys.stdin.read(), os._exit(1)), daemon=True).start()
    task = Task.from_line(line)
    seed = task.options.get("seed", 0)
    for step in range(3):
        print(message(phase="work", done=step, steps=3), end="", flush=True)
        time.sleep(0.02)
    early = Path(task.preview)
    early.with_suffix(".part").write_bytes(Path(task.photo).read_bytes())
    early.with_suffix(".part").rename(early)
    if seed == 5:
        print("not JSON", "[1, 2]", sep="\n", flush=True)
    if seed == 6:
        hoard = bytearray(400_000_000)
        hoard[::4096] = b"x" * len(hoard[::4096])
        time.sleep(60)
    if seed == 7:
        time.sleep(600)
    if seed == 8:
        os._exit(3)
    if seed == 9:
        print(message(refused="photo: expected something else"), end="", flush=True)
        return
    out = Path(task.out)
    staging = out.with_name("staging")
    staging.mkdir()
    (staging / "preview.png").write_bytes(Path(task.photo).read_bytes())
    (staging / "card.json").write_text("{}")
    staging.rename(out)
    print(message(ended=True), end="", flush=True)


if __name__ == "__main__":
    main()
