"""A disk that a killed benchmark has left mounted is found."""

import os

from skyway_lab.benchmarks.chaos.small_disk import left_mounted

#: Linux gives no process such an id.
GONE = 2**22 + 1


def test_only_disks_of_processes_that_are_gone_are_left() -> None:
    mounts = [
        f"skyway-chaos-{GONE} /tmp/left/databases tmpfs rw,size=524288k 0 0",
        f"skyway-chaos-{os.getpid()} /tmp/mine/databases tmpfs rw,size=524288k 0 0",
        "skyway-chaos-disk /tmp/theirs tmpfs rw 0 0",
        "/dev/sda1 / ext4 rw 0 0",
    ]

    assert left_mounted(mounts) == ["/tmp/left/databases"]
