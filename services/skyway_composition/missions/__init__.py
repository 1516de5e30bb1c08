"""Missions: booked in one transaction, sent to a drone, followed to their end.

Three things make its life, each with a package of its parts: `book` (`booking`) makes missions of
the best offer, `follow` (`following`) takes what their drones say, `recompose` (`recomposing`)
finds new plans for those whose plan does not hold. Others change them, too: people (`hands`), what
happens in the world (`affected`), and time (`sweeps`).

What they have in common: `record` is a mission as it is kept; `watch` locks it together with the
link to its drone; `trouble` says that it needs another plan, `ending` ends it; `report` tells the
gateway and the registry, `dispatch` and `hold` the drone, `mission_alarm` the operators. `steps`
and `custody` are what is kept with it, `outlook` judges whether its plan holds, `rest` plans it
anew from where its drone is, `revisions` brings that to the drone, `give_back` frees its pads.
"""
