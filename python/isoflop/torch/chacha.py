"""The random numbers of isoflop: ChaCha8 as `rand_chacha` draws them, so that batches are the built-in
trainer's, number by number."""

import numpy as np

MASK = (1 << 64) - 1
# Blocks of eight numbers that are made at once.
AT_ONCE = 512


def _key(seed):
    """The key that `seed_from_u64` of rand_core makes of a seed: PCG32, eight words."""
    words, state = [], seed & MASK
    for _ in range(8):
        state = (state * 6364136223846793005 + 11634580027462260723) & MASK
        shifted = (((state >> 18) ^ state) >> 27) & 0xFFFFFFFF
        turn = state >> 59
        words.append(((shifted >> turn) | (shifted << (-turn & 31))) & 0xFFFFFFFF)
    return words


def _blocks(key, stream, first, n):
    """Blocks `first..first + n` of a stream as numbers of 64 bits, `[8 n]`."""
    counter = np.arange(first, first + n, dtype=np.uint64)
    start = [0x61707865, 0x3320646E, 0x79622D32, 0x6B206574, *key]
    rows = [np.full(n, word, np.uint32) for word in start]
    rows += [(counter & np.uint64(0xFFFFFFFF)).astype(np.uint32), (counter >> np.uint64(32)).astype(np.uint32)]
    rows += [np.full(n, stream & 0xFFFFFFFF, np.uint32), np.full(n, stream >> 32, np.uint32)]
    x = np.stack(rows)
    before = x.copy()

    def turn(value, by):
        return (value << np.uint32(by)) | (value >> np.uint32(32 - by))

    def quarters(a, b, c, d):
        """Four quarter rounds side by side: rows of four words each."""
        a += b
        d[:] = turn(d ^ a, 16)
        c += d
        b[:] = turn(b ^ c, 12)
        a += b
        d[:] = turn(d ^ a, 8)
        c += d
        b[:] = turn(b ^ c, 7)

    a, b, c, d = (x[i : i + 4] for i in (0, 4, 8, 12))
    for _ in range(4):
        quarters(a, b, c, d)
        b[:], c[:], d[:] = np.roll(b, -1, 0), np.roll(c, -2, 0), np.roll(d, -3, 0)
        quarters(a, b, c, d)
        b[:], c[:], d[:] = np.roll(b, 1, 0), np.roll(c, 2, 0), np.roll(d, 3, 0)
    words = np.ascontiguousarray((x + before).T).reshape(-1, 2).astype(np.uint64)
    return words[:, 0] | (words[:, 1] << np.uint64(32))


class Stream:
    """One stream of a seed; numbers are taken one after another."""

    def __init__(self, seed, stream):
        self.key, self.stream, self.block = _key(seed), stream, 0
        self.left = np.empty(0, np.uint64)

    def peek(self, n):
        """The next `n` numbers of 64 bits, which stay to be taken."""
        parts, missing = [self.left], n - len(self.left)
        while missing > 0:
            blocks = min(AT_ONCE, -(-missing // 8))
            parts.append(_blocks(self.key, self.stream, self.block, blocks))
            self.block, missing = self.block + blocks, missing - 8 * blocks
        self.left = np.concatenate(parts) if len(parts) > 1 else self.left
        return self.left[:n]

    def take(self, n):
        """The next `n` numbers of 64 bits."""
        numbers = self.peek(n)
        self.left = self.left[n:]
        return numbers

    def unit(self):
        """The next number, in [0, 1)."""
        return float(units(self.take(1))[0])

    def below(self, n):
        """The next number, in 0..n."""
        return (int(self.take(1)[0]) * n) >> 64

    def distinct(self, n, k):
        """`k` of the numbers below `n`, each once, in the order drawn."""
        numbers, k = list(range(n)), min(n, k)
        for i, draw in enumerate(self.take(k).tolist()):
            j = i + ((draw * (n - i)) >> 64)
            numbers[i], numbers[j] = numbers[j], numbers[i]
        return numbers[:k]


def units(numbers):
    """Numbers of 64 bits as numbers in [0, 1), by 53 of their bits."""
    return (numbers >> np.uint64(11)).astype(np.float64) / float(1 << 53)


def each_below(numbers, n):
    """Numbers of 64 bits as numbers in 0..n, each below its own `n` (an array, or one for all; below 2^31)."""
    n = np.asarray(n, np.uint64)
    high, low = numbers >> np.uint64(32), numbers & np.uint64(0xFFFFFFFF)
    return ((high * n + ((low * n) >> np.uint64(32))) >> np.uint64(32)).astype(np.int64)
