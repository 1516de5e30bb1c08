"""The queue hands labels out by their key, the newest first among equals."""

from types import SimpleNamespace

import numpy as np


def test_labels_come_out_in_order(plain: SimpleNamespace) -> None:
    random = np.random.default_rng(5)
    keys = random.integers(0, 30, 200).astype(float)
    memory = SimpleNamespace(
        counts=np.zeros(9, np.int64), queue_key=np.empty(200), queue_label=np.empty(200, np.int64)
    )
    for label, key in enumerate(keys):
        plain.queue.push(memory, label, key)

    popped = [int(plain.queue.pop(memory)) for _ in keys]

    assert popped == sorted(range(200), key=lambda label: (keys[label], -label))
