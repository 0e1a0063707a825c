"""A trainer in PyTorch: the built-in trainer's twin, at the speed of a GPU.

isoflop starts it as a module where a sweep says `trainer: torch`; docs/torch.md is the guide. From the same
first weights it takes the same batches as the built-in trainer, and its weights have the same names.
"""
