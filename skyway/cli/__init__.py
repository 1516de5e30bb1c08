"""The `skyway` command.

`main` lists the subcommands, and `entry` is where the installed command begins. `gateway` calls a
running Skyway, and `data_folder` says where each file of a local system is. Rooms: `system`
(`skyway up` and its processes), `demo`, `drones` (`skyway drone` and `skyway fleet`) and `top`.
"""
