"""All stages on one clip, cheap ones first. Nothing is decided here."""

from collections.abc import Callable

from diff4splat.data.clip import Clip
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.data_prep.curation.clip_record import ClipRecord, record_of
from diff4splat.data_prep.curation.hooks import NO_HOOKS, Hooks
from diff4splat.data_prep.curation.stages.camera_motion import score_camera_motion
from diff4splat.data_prep.curation.stages.classes import score_classes
from diff4splat.data_prep.curation.stages.depth_range import score_depth_range
from diff4splat.data_prep.curation.stages.dynamic_mask import score_dynamic_mask
from diff4splat.data_prep.curation.stages.exposure import score_exposure
from diff4splat.data_prep.curation.stages.fingerprints import score_fingerprints
from diff4splat.data_prep.curation.stages.geometry import score_geometry
from diff4splat.data_prep.curation.stages.image_motion import score_image_motion
from diff4splat.data_prep.curation.stages.integrity import score_integrity
from diff4splat.data_prep.curation.stages.quality import score_quality
from diff4splat.data_prep.curation.stages.shot_cuts import score_shot_cuts
from diff4splat.data_prep.curation.stages.track_counts import score_track_counts
from diff4splat.data_prep.curation.working_clip import WorkingClip, working_clip
from diff4splat.errors import ConfigError, MissingExtraError

Stage = Callable[[WorkingClip], WorkingClip]
STAGES: dict[str, Stage] = {
    "integrity": score_integrity,
    "cuts": score_shot_cuts,
    "exposure": score_exposure,
    "motion": score_image_motion,
    "camera": score_camera_motion,
    "depth": score_depth_range,
    "geometry": score_geometry,
    "dynamic": score_dynamic_mask,
    "tracks": score_track_counts,
    "quality": score_quality,
    "duplicates": score_fingerprints,
    "balance": score_classes,
}
"""In order. ``reading`` comes before them: a clip that cannot be read fails there."""


def score_stored_clip(
    folder: ClipFolder, position: int, empty: ClipRecord, hooks: Hooks
) -> ClipRecord:
    """Read and score one clip; whatever it raises becomes the error of its record.

    Raises:
        ConfigError, MissingExtraError: nothing is wrong with the clip but with the run.
    """
    try:
        clip = folder.clip(position)
    except MissingExtraError:
        raise
    except Exception as error:  # one bad clip must not end a run of days
        return empty.failed("reading", error)
    return score_clip(clip, record_of(clip, empty.folder, empty.checksum), hooks)


def score_clip(clip: Clip, record: ClipRecord, hooks: Hooks = NO_HOOKS) -> ClipRecord:
    """``record`` with the scores of every stage, up to one that fails.

    Raises:
        ConfigError, MissingExtraError: nothing is wrong with the clip but with the run.
    """
    working = working_clip(clip, record, hooks)
    for name, stage in STAGES.items():
        try:
            working = stage(working)
        except (ConfigError, MissingExtraError):
            raise
        except Exception as error:  # as above
            return working.record.failed(name, error)
    return working.record
