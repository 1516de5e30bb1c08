"""The same Idempotency-Key gives the same effect and the same answer for a day.

`once` runs a call, `answer_store` stores its answer, `key_secrets` derives what is stored.
"""
