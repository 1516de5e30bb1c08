"""What people do to missions: loaders confirm, operators command, customers cancel.

`confirm_loading` checks what was loaded, `give_command` carries out a command, `cancel` cancels
packages of a delivery and `stop_packages` those of one mission. `give_proof` instructs a
drone to hand over what a recipient has proven. `routes` serves all of it over REST.
"""
