"""An upgrade and a way back while deliveries are requested: two versions on one database."""
