"""From a plain video to an aligned clip: poses, import as a capture, disparity from flow."""

import numpy as np
from textured_clips import textured_clip

from diff4splat.cli.main import run_command
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.io.video import write_video


def test_the_whole_chain_runs_without_weights(tmp_path) -> None:
    clip = textured_clip(9)
    videos = tmp_path / "videos"
    videos.mkdir()
    write_video(clip.views[0].rgb.float() / 255, videos / "walk.mp4", 8.0)
    commands = [
        [
            "prepare",
            "poses",
            f"{videos}/walk.mp4",
            "--out",
            f"{videos}/walk.json",
            "--fov",
            "60.38",
        ],
        ["prepare", "import", str(videos), "--dataset", "capture", "--out", f"{tmp_path}/clips"],
        ["prepare", "align", f"{tmp_path}/clips", "--out", f"{tmp_path}/aligned"],
        ["prepare", "curate", f"{tmp_path}/aligned", "--out", f"{tmp_path}/report"],
    ]
    commands[2] += ["--reference", "triangulation"]
    for arguments in commands:
        run_command(arguments)
    found = ClipFolder(tmp_path / "aligned").clip(0)
    depth, true = found.views[0].depth.numpy(), clip.views[0].depth.numpy()
    known = depth > 0
    factor = np.median(true[known] / depth[known])
    assert known.mean() > 0.4
    assert np.median(np.abs(depth[known] * factor / true[known] - 1)) < 0.06
    assert found.note.metric == "none"
    assert found.note.scale.reference == "triangulation"
    assert (tmp_path / "report" / "report.html").is_file()
