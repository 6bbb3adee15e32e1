"""UMT5 text encoder (arXiv 2304.09151), the one of Wan: T5 with a position bias in every block.

Axes: ``b`` prompts, ``s`` tokens, ``d`` width, ``h`` heads. Attention is not scaled. One prompt is
encoded at a time, so there is no padding inside; the video model knows how many tokens Wan pads
prompts to.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from diff4splat.errors import ConfigError
from diff4splat.models.blocks.norm import TokenRmsNorm
from diff4splat.models.config.networks import TextConfig
from diff4splat.models.text_encoder.encoder import distance_buckets
from diff4splat.models.wan.tokenizer import Tokenizer


class Umt5Block(nn.Module):
    """Self-attention and a gated-GELU perceptron, without biases."""

    def __init__(self, config: TextConfig) -> None:
        super().__init__()
        width, hidden, inner = (
            config.width,
            config.feedforward_width,
            config.heads * config.head_width,
        )
        self.heads = config.heads
        self.attention_norm = TokenRmsNorm(width)
        self.to_query = nn.Linear(width, inner, bias=False)
        self.to_key = nn.Linear(width, inner, bias=False)
        self.to_value = nn.Linear(width, inner, bias=False)
        self.to_output = nn.Linear(inner, width, bias=False)
        if config.encoder == "umt5":
            self.distance_bias = distance_bias(config)
        self.feedforward_norm = TokenRmsNorm(width)
        self.gate = nn.Linear(width, hidden, bias=False)
        self.expand = nn.Linear(width, hidden, bias=False)
        self.contract = nn.Linear(hidden, width, bias=False)

    def forward(
        self,
        states: Float[Tensor, "b s d"],
        buckets: Int[Tensor, "s s"],
        shared: Float[Tensor, "s s h"] | None = None,
    ) -> Float[Tensor, "b s d"]:
        """``buckets`` are those of the distances; ``shared`` replaces the block's own bias."""
        normed = self.attention_norm(states)
        query, key, value = (
            layer(normed).unflatten(-1, (self.heads, -1)).transpose(1, 2)
            for layer in (self.to_query, self.to_key, self.to_value)
        )
        bias = self.distance_bias(buckets) if shared is None else shared
        bias = bias.permute(2, 0, 1)[None].to(query.dtype)
        mixed = torch.nn.functional.scaled_dot_product_attention(query, key, value, bias, scale=1.0)
        states = states + self.to_output(mixed.transpose(1, 2).flatten(2))
        normed = self.feedforward_norm(states)
        gate = torch.nn.functional.gelu(self.gate(normed), approximate="tanh")
        return states + self.contract(gate * self.expand(normed))


def distance_bias(config: TextConfig) -> nn.Embedding:
    """What is added to the logits of every head, by the bucket of a distance."""
    return nn.Embedding(config.relative_position_buckets, config.heads)


class Umt5Encoder(nn.Module):
    """Prompts to one state per token of a vocabulary of 256 thousand."""

    def __init__(self, config: TextConfig) -> None:
        super().__init__()
        self.config = config
        self.embedding = nn.Embedding(config.vocabulary, config.width)
        self.blocks = nn.ModuleList([Umt5Block(config) for _ in range(config.blocks)])
        self.norm_out = TokenRmsNorm(config.width)
        self.tokenizer: Tokenizer | None = None

    def forward(self, tokens: Int[Tensor, "b s"]) -> Float[Tensor, "b s d"]:
        """States of tokens that are all real."""
        buckets = distance_buckets(tokens.shape[1], self.config, tokens.device)
        # The table may be stored in half precision: only the rows that are used are widened.
        states = self.embedding(tokens).to(self.norm_out.weight.dtype)
        shared = self.shared_bias(buckets)
        for block in self.blocks:
            states = block(states, buckets, shared)
        return self.norm_out(states)

    def shared_bias(self, buckets: Int[Tensor, "s s"]) -> Float[Tensor, "s s h"] | None:
        """The bias of all blocks; None where each has its own."""
        del buckets

    def encode_prompt(self, text: str) -> Float[Tensor, "1 s d"]:
        """States of one prompt, which may be empty.

        Raises:
            ConfigError: the encoder has no tokenizer.
        """
        tokens = torch.tensor([self.token_row(text)], device=self.embedding.weight.device)
        return self(tokens)

    def token_row(self, text: str) -> list[int]:
        """Tokens of one prompt.

        Raises:
            ConfigError: the encoder has no tokenizer.
        """
        if self.tokenizer is None:
            raise ConfigError(
                "text encoder: expected a model folder with tokenizer.json, got none; "
                "import the model again"
            )
        return self.tokenizer.token_row(text)

    def encode_prompts(
        self, texts: list[str]
    ) -> tuple[Float[Tensor, "b s d"], Bool[Tensor, "b s"]]:
        """States of several prompts, padded with zeros to the longest, and which are real."""
        rows = [self.encode_prompt(text)[0] for text in texts]
        lengths = torch.tensor([len(row) for row in rows], device=rows[0].device)
        states = torch.nn.utils.rnn.pad_sequence(rows, batch_first=True)
        return states, torch.arange(states.shape[1], device=states.device) < lengths[:, None]


UMT5_KEYS = {
    "shared.weight": "embedding.weight",
    "encoder.final_layer_norm.weight": "norm_out.weight",
    "layer.0.layer_norm.": "attention_norm.",
    "layer.0.SelfAttention.q.": "to_query.",
    "layer.0.SelfAttention.k.": "to_key.",
    "layer.0.SelfAttention.v.": "to_value.",
    "layer.0.SelfAttention.o.": "to_output.",
    "layer.0.SelfAttention.relative_attention_bias.": "distance_bias.",
    "layer.1.layer_norm.": "feedforward_norm.",
    "layer.1.DenseReluDense.wi_0.": "gate.",
    "layer.1.DenseReluDense.wi_1.": "expand.",
    "layer.1.DenseReluDense.wo.": "contract.",
    "encoder.block.": "blocks.",
}
"""Part of a name in transformers → part of ours."""


def umt5_key(key: str) -> str | None:
    """Our name of a public weight; None for the copy of the embedding that some files hold."""
    if key == "encoder.embed_tokens.weight":
        return None
    for old, new in UMT5_KEYS.items():
        key = key.replace(old, new)
    return key
