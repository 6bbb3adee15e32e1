"""What the recipe of ``small`` fixes for its stages."""

from diff4splat.configs.recipes import recipe_by_name


def test_a_public_backbone_learns_slowly() -> None:
    stages = {stage.name: stage for stage in recipe_by_name("small").stages}
    for name in ("monocular_depth", "object_mask"):
        assert stages[name].public_backbone
        rates = dict(stages[name].optimizer.part_rates)
        assert 0 < rates[f"{name}.backbone"] <= 0.2
