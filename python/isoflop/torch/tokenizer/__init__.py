"""The trainer of tokenizers: the built-in trainer's twin.

isoflop starts it as a module if a sweep says `tokenizer: {trainer: torch}`. From the same first weights it
takes the same windows as the built-in trainer, and its weights have the same names.
"""
