"""Alarms: problems that an operator must look at and acknowledge.

`alarm` is the alarm as REST shows it, `store` its SQL, `routes` lists and acknowledges alarms.
"""
