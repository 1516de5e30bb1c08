"""The queue: the label with the earliest possible delivery comes first."""

from skyway.planner.kernels.compiler import kernel
from skyway.planner.kernels.memory import QUEUE, Memory


@kernel
def push(memory: Memory, label: int, key: float) -> None:
    """Put a label into the queue; with equal keys the newer label comes first."""
    keys, labels = memory.queue_key, memory.queue_label
    slot = memory.counts[QUEUE]
    memory.counts[QUEUE] = slot + 1
    while slot > 0:
        above = (slot - 1) >> 1
        if keys[above] < key or (keys[above] == key and labels[above] > label):
            break
        keys[slot] = keys[above]
        labels[slot] = labels[above]
        slot = above
    keys[slot] = key
    labels[slot] = label


@kernel
def pop(memory: Memory) -> int:
    """Take the label with the least key out of the queue."""
    keys, labels = memory.queue_key, memory.queue_label
    taken = labels[0]
    size = memory.counts[QUEUE] - 1
    memory.counts[QUEUE] = size
    key, label = keys[size], labels[size]
    slot = 0
    while True:
        below = 2 * slot + 1
        if below >= size:
            break
        right = below + 1
        if right < size and (
            keys[right] < keys[below]
            or (keys[right] == keys[below] and labels[right] > labels[below])
        ):
            below = right
        if key < keys[below] or (key == keys[below] and label > labels[below]):
            break
        keys[slot] = keys[below]
        labels[slot] = labels[below]
        slot = below
    keys[slot] = key
    labels[slot] = label
    return taken
