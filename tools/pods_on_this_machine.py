"""Runs the containers of rendered pods on one Linux machine, as kubelet does; needs root.

Each container has its own root that cannot be written, its own mounts, user and variables, and no
capabilities. The volumes have the owners and modes that Kubernetes gives them. The image is this
machine's own file system, with the checkout and its environment.
"""

import os
import shlex
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parent.parent

#: What every container sees of this machine beside its system: the checkout and Python.
_SEEN: Final = (ROOT, Path(sys.base_prefix))

#: The Dockerfile's own variables.
IMAGE: Final = {
    "PATH": f"{ROOT}/.venv/bin:/usr/sbin:/usr/bin:/sbin:/bin",
    "HOME": "/var/lib/skyway",
    "SKYWAY_DATA": "/var/lib/skyway",
    "NUMBA_CACHE_DIR": "/var/cache/skyway",
    "NUMBA_CPU_NAME": "x86-64-v3",
    "NUMBA_CPU_FEATURES": "",
    "PYTHONUNBUFFERED": "1",
}

#: An object of Kubernetes, or a part of one: its members have every type.
Document = dict[str, Any]


class Machine:
    """The volumes and running containers of all pods.

    Parameters
    ----------
    folder
        An empty folder for volumes, roots and logs.
    secrets
        The folder of files of each Secret.
    configs
        The files of each ConfigMap.
    compiled
        A folder with the compiled planner, as the image has it.
    """

    def __init__(
        self,
        folder: Path,
        *,
        secrets: Mapping[str, Path],
        configs: Mapping[str, Mapping[str, str]],
        compiled: Path,
    ) -> None:
        self._folder = folder
        self._secrets = secrets
        self._configs = configs
        self._compiled = compiled
        self._running: dict[str, list[subprocess.Popen[bytes]]] = {}

    def start(self, pod: Document) -> None:
        """Run its first containers to their end, then start the others; those of a job end too.

        Raises
        ------
        RuntimeError
            A container that has to end did not end well; the message has the end of its log.
        """
        name, spec = pod["metadata"]["name"], pod["spec"]["template"]["spec"]
        volumes = self._volumes(name, spec)
        for container in spec.get("initContainers", ()):
            self._run(name, container, spec, volumes)
        for container in spec["containers"]:
            if pod["kind"] == "Job":
                self._run(name, container, spec, volumes)
            else:
                process = self._open(name, container, spec, volumes)
                self._running.setdefault(name, []).append(process)

    def execute(self, pod: Document, command: Sequence[str]) -> None:
        """Run a command as in the first container of a pod that runs.

        Raises
        ------
        RuntimeError
            The command failed; the message has the end of its log.
        """
        name, spec = pod["metadata"]["name"], pod["spec"]["template"]["spec"]
        volumes = {each["name"]: self._folder / name / each["name"] for each in spec["volumes"]}
        container = {**spec["containers"][0], "name": "command", "command": command}
        self._run(name, container, spec, volumes)

    def stop(self, name: str) -> None:
        """Ask the containers of a pod to end, wait for them, and delete its volumes."""
        processes = self._running.pop(name)
        for process in processes:
            process.send_signal(signal.SIGTERM)
        for process in processes:
            process.wait(timeout=60)
        shutil.rmtree(self._folder / name)

    def stop_all(self) -> None:
        """Stop every pod."""
        for name in list(self._running):
            self.stop(name)

    def _volumes(self, pod: str, spec: Document) -> Mapping[str, Path]:
        group = spec["securityContext"]["fsGroup"]
        made = {}
        for volume in spec["volumes"]:
            path = self._folder / pod / volume["name"]
            path.mkdir(parents=True)
            os.chown(path, 0, group)
            path.chmod(0o2777)
            if "secret" in volume:
                source, chosen = self._secrets[volume["secret"]["secretName"]], volume["secret"]
                keys = [item["key"] for item in chosen.get("items", ())] or [
                    file.name for file in source.iterdir()
                ]
                for key in keys:
                    shutil.copyfile(source / key, path / key)
                    os.chown(path / key, 0, group)
                    (path / key).chmod(chosen["defaultMode"])
            elif "configMap" in volume:
                for key, text in self._configs[volume["configMap"]["name"]].items():
                    (path / key).write_text(text)
            made[volume["name"]] = path
        return made

    def _run(
        self, pod: str, container: Document, spec: Document, volumes: Mapping[str, Path]
    ) -> None:
        if self._open(pod, container, spec, volumes).wait(timeout=300):
            log = self._log(pod, container).read_text()
            raise RuntimeError(f"{container['name']} of {pod} failed:\n{log[-2000:]}")

    def _open(
        self, pod: str, container: Document, spec: Document, volumes: Mapping[str, Path]
    ) -> subprocess.Popen[bytes]:
        steps = [*self._mounts(container, volumes), self._command(container, spec)]
        with self._log(pod, container).open("ab") as log:
            command = ["unshare", "--mount", "sh", "-ec", "\n".join(steps)]
            return subprocess.Popen(command, stdout=log, stderr=log)

    def _log(self, pod: str, container: Document) -> Path:
        return self._folder / f"{pod}-{container['name']}.log"

    def _mounts(self, container: Document, volumes: Mapping[str, Path]) -> Sequence[str]:
        """Shell lines that build the container's root in /run."""
        steps = [
            "mount --make-rprivate /",
            "mount -t tmpfs none /run",
            "mkdir /run/upper /run/work /run/root",
            "mount -t overlay -o lowerdir=/,upperdir=/run/upper,workdir=/run/work none /run/root",
            # Python may be in the folder of a user whom the container's user is not.
            "chmod 755 /run/root/root",
            "mount --rbind /dev /run/root/dev",
            "mount --rbind /proc /run/root/proc",
            "cp /etc/hosts /run/root/etc/hosts",
            _bind(self._compiled, IMAGE["NUMBA_CACHE_DIR"]),
        ]
        for mount in sorted(container.get("volumeMounts", ()), key=lambda each: each["mountPath"]):
            source = volumes[mount["name"]] / mount.get("subPath", "")
            steps.append(_bind(source, mount["mountPath"], is_fixed=mount.get("readOnly", False)))
        return [
            *steps,
            *(_bind(path, str(path), is_fixed=True) for path in _SEEN),
            "mount -o remount,ro /run/root",
        ]

    def _command(self, container: Document, spec: Document) -> str:
        user, group = (spec["securityContext"][name] for name in ("runAsUser", "runAsGroup"))
        given = {each["name"]: each["value"] for each in container.get("env", ())}
        variables = [f"{name}={value}" for name, value in {**IMAGE, **given}.items()]
        return shlex.join(
            [
                *("exec", "chroot", "/run/root", "setpriv", f"--reuid={user}", f"--regid={group}"),
                *(f"--groups={group}", "--inh-caps=-all", "--bounding-set=-all"),
                *("--no-new-privs", "env", "-i", *variables, *container["command"]),
            ]
        )


def _bind(source: Path, place: str, *, is_fixed: bool = False) -> str:
    """A shell line that shows a file or a folder at a place of the container's root."""
    # Such as /var/run, which is a link to /run: here it would lead out of the container's root.
    target = f"/run/root{Path(place).resolve()}"
    make = f"mkdir -p {target}" if source.is_dir() else f"touch {target}"
    line = f"{make}; mount --bind {source} {target}"
    return f"{line}; mount -o remount,bind,ro {target}" if is_fixed else line
