#!/bin/sh
# step.sh 2/4 "Installing packages" COMMAND ...: runs the command, and says every few seconds that it goes on.
# At a terminal one line counts the seconds; elsewhere each word is a line. The command's errors come between.
what="[$1] $2"
shift 2
if [ -t 1 ]; then every_s=1 begin='\r' end='        '; else every_s=4 begin='' end='\n'; fi
began_s=$(date +%s)
say() { printf "$begin%s: %s$end" "$what" "$1"; }
say "begins"
# The sleep outlives this loop by its last moment, so it must not hold the output open. The loop ends with this script.
(while sleep "$every_s" >/dev/null 2>&1 && kill -0 $$ 2>/dev/null; do say "$(($(date +%s) - began_s)) s"; done) &
ticks=$!
trap 'kill "$ticks" 2>/dev/null' EXIT
trap 'exit 130' INT TERM
code=0
"$@" || code=$?
kill "$ticks" 2>/dev/null
if [ "$code" -eq 0 ]; then state=done; else state=failed; fi
say "$state after $(($(date +%s) - began_s)) s"
[ -t 1 ] && echo
exit "$code"
