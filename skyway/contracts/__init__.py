"""What crosses a wire, each message and body defined once.

`topics` has every MQTT topic; `instruction`, `drone_report`, `world` and `delivery_event` are their
messages. `candidate`, `shortlist`, `quote`, `mission`, `mission_reports`, `drones`,
`station_check`, `track` and `forgotten_deliveries` are bodies between services. `network_document`
and `weather` are documents that operators send. `problem_details`
describes errors and their codes. `delivery_event_forms` and `delivery_event_data` describe events
to customers. `asyncapi`, `rest_tags`, `rest_examples` and the `*_examples` make the published
documents.
"""
