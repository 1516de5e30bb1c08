"""Proofs of hand-overs: PINs, signatures and photos, which leave this room for people only.

`verification` says how customers ask for a proof, and what is known of one; `store` has the SQL.
`signature` and `photo` check pictures, `photo_store` keeps photos, and `upload_links` makes the
addresses to which drones upload photos.
"""
