"""What a tokenizer is made of and how it is trained, as isoflop writes it."""

import math

VERSION = 1


class Spec:
    """The document behind `--spec`."""

    def __init__(self, document):
        if document["version"] != VERSION:
            found = document["version"]
            raise SystemExit(
                f"the tokenizer is described in version {found}, this trainer reads {VERSION}: install the Python "
                "package of the isoflop that starts it"
            )
        own = document["spec"]
        self.architecture, self.quantizer = own["architecture"], own["quantizer"]
        self.training = own["training"]
        self.pool, self.init, self.text = document["pool"], document["init"], document["text"]
        self.drawn, self.codebook_keys = document["drawn"], document["codebook_keys"]
        self.checkpoint_s = document["checkpoint_s"]
        self.steps, self.seed = self.training["steps"], self.training["seed"]
        self.language = self.architecture.get("language")

    @property
    def is_transformer(self):
        return self.architecture["kind"] == "transformer"

    @property
    def stride(self):
        """Frames that windows are multiples of."""
        return self.architecture["frames"] if self.is_transformer else 2 ** self.architecture["down"]

    @property
    def code_dim(self):
        """Channels of a latent."""
        return self.architecture["latent" if self.is_transformer else "width"]

    @property
    def by_joints(self):
        """Whether the loss is in joints; then clips shorter than a window take part."""
        return self.training["loss"] == "joints"

    def shortest_window(self):
        """Strides of the shortest window; as many as of the longest one if all are of one length."""
        most = self.training["window"] // self.stride
        if not self.is_transformer:
            return most
        # As many latents as the longest scale has codes, which a fixed number of them are.
        scales = [] if "latents" in self.architecture else self.quantizer.get("scales", [])
        return max(int(0.25 * most), *scales, 1)

    def learning_rate(self, step):
        """The rate of a step, counted from 0: a linear warm-up, then a fall at once or along a cosine."""
        training = self.training
        warmup = min((step + 1) / (training["warmup_steps"] + 1), 1.0)
        done, last, fall = step / self.steps, training["decay_factor"], 1.0
        if training["schedule"] == "cosine":
            fall = last + (1.0 - last) * 0.5 * (1.0 + math.cos(math.pi * done))
        elif done >= training["decay_at"]:
            fall = last
        return training["lr"] * warmup * fall
