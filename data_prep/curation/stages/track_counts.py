"""Stage 9: how many tracks can be trusted, and how many of them move."""

from diff4splat.data_prep.curation.tracks.filtering import moving_tracks, reliable_tracks
from diff4splat.data_prep.curation.working_clip import WorkingClip


def score_track_counts(working: WorkingClip) -> WorkingClip:
    """``tracks_reliable`` and ``tracks_moving``; absent without tracks."""
    if working.clip.tracks is None or working.view.track_uv is None:
        return working
    reliable = reliable_tracks(working.clip)
    moving = moving_tracks(working.clip) & reliable
    return working.scored(
        tracks_reliable=float(reliable.sum()),
        tracks_moving=float(moving.sum()),
        tracks_reliable_share=float(reliable.float().mean()) if len(reliable) else None,
    )
