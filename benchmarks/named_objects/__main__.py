"""Print how well a model finds named objects: ``python -m benchmarks.named_objects CLIPS MODEL``.

``CLIPS`` are worlds of 128 px (``prepare synth --size 128 --still-share 0``).

overlap   of the mask with the object that was asked for
found     the most probable pixel is on it
whole     four fifths of it are in the mask
still     no pixel moves where the sentence asks for an object that is not there
auc       an object has a higher most probable pixel than an absent one has

``--unknown-nouns`` asks by colour and a noun that no training shows, ``--objects 99`` for every
object of an image in place of two, ``--without-instances`` does not share probabilities among the
pixels of one object, ``--without-classifier`` leaves the image classifier out.
"""

import argparse
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor

from benchmarks.named_objects.requests import OBJECTS, AskedImage, asked_image
from diff4splat.captions.image_classes.prompt_classes import prompt_classes
from diff4splat.data.clip_folder import ClipFolder
from diff4splat.generation.inputs.input_image import InputImage, downsample, enlarged
from diff4splat.generation.motion.motion_mask import MotionProbability, motion_probability
from diff4splat.generation.motion.networks import motion_prior
from diff4splat.generation.motion.sampling import MotionRequest
from diff4splat.generation.plan import MOTION_PARTS
from diff4splat.generation.settings import GenerationSettings
from diff4splat.geometry.camera import pinhole
from diff4splat.models.hub.model import Model, load_model

THRESHOLD = GenerationSettings().motion.threshold
COLUMNS = ("overlap", "found", "whole", "still", "auc")


def motion_of(model: Model, rgb: Tensor, sentence: str) -> MotionProbability:
    """What the model's motion prior says of one sentence."""
    camera = pinhole(float(rgb.shape[1]), tuple(rgb.shape[:2]))
    image = InputImage(rgb=rgb, camera=camera, focal_source="")
    text = model.networks.text_encoder.encode_prompt(sentence)
    classes = prompt_classes(sentence)
    request = MotionRequest(text=text, seed=0, settings=GenerationSettings(), classes=classes)
    return motion_probability(motion_prior(model.networks), image, 2, request)


def without_classifier(model: Model) -> Model:
    """The object mask alone decides."""
    return replace(model, networks=replace(model.networks, image_classifier=None))


def soft(rgb: Tensor) -> Tensor:
    """As an image of half the sides comes to the network."""
    camera = pinhole(float(rgb.shape[1]), tuple(rgb.shape[:2]))
    image = InputImage(rgb=rgb, camera=camera, focal_source="")
    return enlarged(downsample(image, 2), 2).rgb


def measure(sample: MotionProbability, truth: Tensor) -> dict[str, float]:
    """Columns that apply."""
    mask = sample.mask(THRESHOLD)
    if not bool(truth.any()):
        return {"still": float(not bool(mask.any()))}
    shared = int((mask & truth).sum())
    return {
        "overlap": shared / int((mask | truth).sum()),
        "found": float(truth.flatten()[sample.probability.argmax()]),
        "whole": float(shared >= 0.8 * int(truth.sum())),
    }


def rows(model: Model, images: list[AskedImage]) -> dict[str, dict[str, float]]:
    """Means of sharp images of 128 px, and of enlarged ones of 64 px."""
    table = {}
    for name, change in (("128 px", lambda rgb: rgb), ("64 px enlarged", soft)):
        values: dict[str, list[float]] = defaultdict(list)
        for image in images:
            for sentence, truth in image.requests:
                collect(values, motion_of(model, change(image.rgb), sentence), truth)
        table[name] = means(values)
    return table


def collect(values: dict[str, list[float]], sample: MotionProbability, truth: Tensor) -> None:
    """Add what ``measure`` says, and the highest probability."""
    kind = "present" if bool(truth.any()) else "absent"
    values[kind].append(float(sample.probability.max()))
    for column, value in measure(sample, truth).items():
        values[column].append(value)


def means(values: dict[str, list[float]]) -> dict[str, float]:
    """Of every column, with the area under the curve."""
    table = {column: sum(all_) / len(all_) for column, all_ in values.items()}
    return table | {"auc": auc(values["present"], values["absent"])}


def auc(present: list[float], absent: list[float]) -> float:
    """Share of pairs in which the present one is higher; ties count half. NaN without a pair."""
    difference = torch.tensor(present)[:, None] - torch.tensor(absent)
    return float((difference.sign() + 1).mean() / 2)


@torch.no_grad()
def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("clips", type=Path)
    parser.add_argument("model")
    parser.add_argument("--most", type=int, default=120)
    parser.add_argument("--unknown-nouns", action="store_true")
    parser.add_argument("--objects", type=int, default=OBJECTS)
    parser.add_argument("--without-instances", action="store_true")
    parser.add_argument("--without-classifier", action="store_true")
    options = parser.parse_args()
    model, folder = load_model(options.model, parts=MOTION_PARTS), ClipFolder(options.clips)
    if options.without_instances:
        model.networks.object_mask.instances = None
    if options.without_classifier:
        model = without_classifier(model)
    count = min(len(folder), options.most)
    asking = {"unknown_nouns": options.unknown_nouns, "most_objects": options.objects}
    images = [asked_image(folder.clip(index), **asking) for index in range(count)]
    print("| images |", " | ".join(COLUMNS), "|\n|---|" + "---:|" * len(COLUMNS))
    for name, values in rows(model, images).items():
        print(f"| {name} |", " | ".join(f"{values[column]:.3f}" for column in COLUMNS), "|")


if __name__ == "__main__":
    main()
