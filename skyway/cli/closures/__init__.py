"""`skyway close`, `skyway open` and `skyway closures`: what operators close, and open again."""
