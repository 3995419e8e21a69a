"""XXH3-64 and XXH3-128 in plain Python (checksums.md), about 50 MB/s.

Written from the xxHash specification, section XXH3; secrets and primes are its constants.
"""

import struct
from operator import mul

M32 = 0xFFFFFFFF
M64 = 0xFFFFFFFFFFFFFFFF
P32_1, P32_2, P32_3 = 0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D
P64_1, P64_2, P64_3 = 0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9
P64_4, P64_5 = 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5
MIX_1, MIX_2 = 0x165667919E3779F9, 0x9FB21C651E98DF25
SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671fcb79e64eccc0e578"
    "825ad07dccff7221b8084674f743248ee03590e6813a264c3c2852bb91c300cb88d0658b1b532ea3"
    "71644897a20df94e3819ef46a9deacd8a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931"
    "c89f7ec9d9787364eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e"
    "2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e")
SECRET_BYTES = len(SECRET)
STRIPE, BLOCK = 64, 1024  # a block is 16 stripes: the secret moves on by 8 bytes a stripe
_LANES = struct.Struct("<128Q")
_HALVES = struct.Struct("<256I")


def _u32(data, at):
    return int.from_bytes(data[at:at + 4], "little")


def _u64(data, at):
    return int.from_bytes(data[at:at + 8], "little")


def _swap32(v):
    return int.from_bytes(v.to_bytes(4, "little"), "big")


def _swap64(v):
    return int.from_bytes(v.to_bytes(8, "little"), "big")


def _rotate(v, n):
    return (v << n | v >> (64 - n)) & M64


def _fold(a, b):
    product = a * b
    return (product & M64) ^ (product >> 64)


def _avalanche(h):
    h &= M64
    h ^= h >> 37
    h = h * MIX_1 & M64
    return h ^ h >> 32


def _avalanche_64(h):  # that of XXH64
    h &= M64
    h ^= h >> 33
    h = h * P64_2 & M64
    h ^= h >> 29
    h = h * P64_3 & M64
    return h ^ h >> 32


def _mix_16(data, at, secret_at, seed):
    return _fold(_u64(data, at) ^ (_u64(SECRET, secret_at) + seed & M64),
                 _u64(data, at + 8) ^ (_u64(SECRET, secret_at + 8) - seed & M64))


def _short_seed(seed):
    return seed ^ _swap32(seed & M32) << 32


def _small_word(data):  # 1 to 3 bytes
    n = len(data)
    return data[0] << 16 | data[n >> 1] << 24 | data[-1] | n << 8


# 0 to 240 bytes, 64 bits ------------------------------------------------------------------------

def _up_to_16(data, seed):
    n = len(data)
    if n > 8:
        low = _u64(data, 0) ^ ((_u64(SECRET, 24) ^ _u64(SECRET, 32)) + seed & M64)
        high = _u64(data, n - 8) ^ ((_u64(SECRET, 40) ^ _u64(SECRET, 48)) - seed & M64)
        return _avalanche(n + _swap64(low) + high + _fold(low, high))
    if n >= 4:
        flip = (_u64(SECRET, 8) ^ _u64(SECRET, 16)) - _short_seed(seed) & M64
        h = (_u32(data, n - 4) + (_u32(data, 0) << 32)) ^ flip
        h ^= _rotate(h, 49) ^ _rotate(h, 24)
        h = h * MIX_2 & M64
        h ^= (h >> 35) + n
        h = h * MIX_2 & M64
        return h ^ h >> 28
    if n > 0:
        return _avalanche_64(_small_word(data) ^ (_u32(SECRET, 0) ^ _u32(SECRET, 4)) + seed)
    return _avalanche_64(seed ^ _u64(SECRET, 56) ^ _u64(SECRET, 64))


def _up_to_128(data, seed):
    n = len(data)
    acc = n * P64_1
    for i in reversed(range((n - 1) // 32 + 1)):
        acc += _mix_16(data, 16 * i, 32 * i, seed)
        acc += _mix_16(data, n - 16 * (i + 1), 32 * i + 16, seed)
    return _avalanche(acc)


def _up_to_240(data, seed):
    n = len(data)
    acc = n * P64_1
    for i in range(8):
        acc += _mix_16(data, 16 * i, 16 * i, seed)
    acc = _avalanche(acc)
    for i in range(8, n // 16):
        acc += _mix_16(data, 16 * i, 16 * (i - 8) + 3, seed)
    return _avalanche(acc + _mix_16(data, n - 16, 136 - 17, seed))


# 0 to 240 bytes, 128 bits -----------------------------------------------------------------------

def _wide_up_to_16(data, seed):
    n = len(data)
    if n > 8:
        low_flip = (_u64(SECRET, 32) ^ _u64(SECRET, 40)) - seed & M64
        high_flip = (_u64(SECRET, 48) ^ _u64(SECRET, 56)) + seed & M64
        high = _u64(data, n - 8)
        m = (_u64(data, 0) ^ high ^ low_flip) * P64_1
        m_low = (m & M64) + (n - 1 << 54) & M64
        high ^= high_flip
        m_high = (m >> 64) + high + (high & M32) * (P32_2 - 1) & M64
        h = (m_low ^ _swap64(m_high)) * P64_2
        return _avalanche(h), _avalanche((h >> 64) + m_high * P64_2)
    if n >= 4:
        flip = (_u64(SECRET, 16) ^ _u64(SECRET, 24)) + _short_seed(seed) & M64
        m = ((_u32(data, 0) + (_u32(data, n - 4) << 32)) ^ flip) * (P64_1 + (n << 2))
        low, high = m & M64, m >> 64
        high = high + (low << 1) & M64
        low ^= high >> 3
        low ^= low >> 35
        low = low * MIX_2 & M64
        return low ^ low >> 28, _avalanche(high)
    if n > 0:
        low = _small_word(data)
        high = _swap32(low)
        high = (high << 13 | high >> 19) & M32
        return (_avalanche_64(low ^ (_u32(SECRET, 0) ^ _u32(SECRET, 4)) + seed & M64),
                _avalanche_64(high ^ (_u32(SECRET, 8) ^ _u32(SECRET, 12)) - seed & M64))
    return (_avalanche_64(seed ^ _u64(SECRET, 64) ^ _u64(SECRET, 72)),
            _avalanche_64(seed ^ _u64(SECRET, 80) ^ _u64(SECRET, 88)))


def _mix_32(low, high, data, at_1, at_2, secret_at, seed):
    low = low + _mix_16(data, at_1, secret_at, seed) & M64
    low ^= _u64(data, at_2) + _u64(data, at_2 + 8) & M64
    high = high + _mix_16(data, at_2, secret_at + 16, seed) & M64
    high ^= _u64(data, at_1) + _u64(data, at_1 + 8) & M64
    return low, high


def _wide_middle(data, seed):  # 17 to 240
    n = len(data)
    low, high = n * P64_1 & M64, 0
    if n <= 128:
        for i in reversed(range((n - 1) // 32 + 1)):
            low, high = _mix_32(low, high, data, 16 * i, n - 16 * (i + 1), 32 * i, seed)
    else:
        for i in range(4):
            low, high = _mix_32(low, high, data, 32 * i, 32 * i + 16, 32 * i, seed)
        low, high = _avalanche(low), _avalanche(high)
        for i in range(4, n // 32):
            low, high = _mix_32(low, high, data, 32 * i, 32 * i + 16, 3 + 32 * (i - 4), seed)
        low, high = _mix_32(low, high, data, n - 16, n - 32, 136 - 17 - 16, -seed & M64)
    total = low * P64_1 + high * P64_4 + (n - seed & M64) * P64_2
    return _avalanche(low + high), -_avalanche(total) & M64


# More than 240 bytes ----------------------------------------------------------------------------

def _secret_for(seed):
    if seed == 0:
        return SECRET
    out = bytearray()
    for i in range(0, SECRET_BYTES, 16):
        out += (_u64(SECRET, i) + seed & M64).to_bytes(8, "little")
        out += (_u64(SECRET, i + 8) - seed & M64).to_bytes(8, "little")
    return bytes(out)


def _add_stripe(acc, stripe, key):
    lanes = struct.unpack("<8Q", stripe)
    for i in range(8):
        mixed = lanes[i] ^ _u64(key, 8 * i)
        acc[i] += lanes[i ^ 1] + (mixed & M32) * (mixed >> 32)


def _accumulate(data, secret):
    """The eight accumulators after all of `data`.

    A block is mixed whole: one xor of two great integers, one product a lane and stripe, and one
    sum of 16 a lane. Sums are cut to 64 bits at the end of a block only.
    """
    acc = [P32_3, P64_1, P64_2, P64_3, P64_4, P32_2, P64_5, P32_1]
    n = len(data)
    key = int.from_bytes(b"".join(secret[8 * s:8 * s + STRIPE] for s in range(16)), "little")
    scramble = struct.unpack("<8Q", secret[SECRET_BYTES - STRIPE:])
    blocks = (n - 1) // BLOCK
    for at in range(0, blocks * BLOCK, BLOCK):
        block = data[at:at + BLOCK]
        lanes = _LANES.unpack(block)
        mixed = _HALVES.unpack((int.from_bytes(block, "little") ^ key).to_bytes(BLOCK, "little"))
        products = list(map(mul, mixed[0::2], mixed[1::2]))
        for i in range(8):
            lane = acc[i] + sum(lanes[i ^ 1::8]) + sum(products[i::8]) & M64
            acc[i] = (lane ^ lane >> 47 ^ scramble[i]) * P32_1 & M64
    for s, at in enumerate(range(blocks * BLOCK, n - 1 - (STRIPE - 1), STRIPE)):
        _add_stripe(acc, data[at:at + STRIPE], secret[8 * s:8 * s + STRIPE])
    _add_stripe(acc, data[n - STRIPE:], secret[SECRET_BYTES - STRIPE - 7:])
    return [lane & M64 for lane in acc]


def _merge(acc, secret, at, start):
    for i in range(0, 8, 2):
        start += _fold(acc[i] ^ _u64(secret, at + 8 * i), acc[i + 1] ^ _u64(secret, at + 8 * i + 8))
    return _avalanche(start)


def xxh3_64(data, seed=0):
    """XXH3-64 of bytes."""
    n = len(data)
    if n <= 16:
        return _up_to_16(data, seed)
    if n <= 128:
        return _up_to_128(data, seed)
    if n <= 240:
        return _up_to_240(data, seed)
    secret = _secret_for(seed)
    return _merge(_accumulate(data, secret), secret, 11, n * P64_1 & M64)


def xxh3_128(data, seed=0):
    """XXH3-128 of bytes: (low, high)."""
    n = len(data)
    if n <= 16:
        return _wide_up_to_16(data, seed)
    if n <= 240:
        return _wide_middle(data, seed)
    secret = _secret_for(seed)
    acc = _accumulate(data, secret)
    return (_merge(acc, secret, 11, n * P64_1 & M64),
            _merge(acc, secret, SECRET_BYTES - STRIPE - 11, ~(n * P64_2) & M64))


def check_table(path):
    """Compares with a table of hashes (vectors/xxh3.txt); the number of rows that agree.

    Raises ValueError naming the first row that does not.
    """
    bytes_, x = bytearray(), 1
    for _ in range(1 << 16):
        x = x * 6364136223846793005 + 1442695040888963407 & M64
        bytes_.append(x >> 56)
    rows = 0
    with open(path, encoding="ascii") as table:
        for line in table:
            if line.startswith("#"):
                continue
            length, seed, narrow, wide = line.split()
            data, seed = bytes(bytes_[:int(length)]), int(seed, 16)
            low, high = xxh3_128(data, seed)
            if xxh3_64(data, seed) != int(narrow, 16) or high << 64 | low != int(wide, 16):
                raise ValueError("XXH3 disagrees with: " + line.strip())
            rows += 1
    return rows
