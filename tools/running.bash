# shellcheck shell=bash
# Running things so that Ctrl-C, kill and a closed terminal leave nothing behind. To be sourced.

sudo=() # what makes a command root's
ended=  # the process group that ran last, once nothing of it is left; another one in $! is still at it

# Runs a command in a process group of its own until nothing of the group is left.
run() {
    local status
    set -m
    "$@" < /dev/null &
    set +m
    wait $!
    status=$?
    while group_runs; do sleep 0.05; done
    ended=$!
    return "$status"
}

group_runs() { kill -0 -- -$! 2> /dev/null; }

# interrupt STATUS: a signal, from the terminal or to us alone, goes on to the group, and ends us once that has ended.
# Whoever ignores it is asked harder every 10 s.
interrupt() {
    local signal tenths
    [[ ${!-} != "$ended" ]] || exit "$1"
    trap '' HUP INT TERM
    say 'stopping …'
    for signal in INT TERM KILL; do
        kill -s "$signal" -- -$! 2> /dev/null
        # What sudo started belongs to root, and only root may signal it.
        ((!${#sudo[@]})) || "${sudo[@]}" kill -s "$signal" -- -$! 2> /dev/null
        for ((tenths = 0; tenths < 100; tenths++)); do
            group_runs || exit "$1"
            sleep 0.1
        done
    done
    exit "$1"
}
trap 'interrupt 129' HUP
trap 'interrupt 130' INT
trap 'interrupt 143' TERM

# For what reads a pipe: the writer stops on the same signal, and may still say its last words.
to_the_end() {
    trap '' HUP INT TERM
    "$@"
}

# logged LOG COMMAND…: the command's output goes to a log, and every five seconds we say how far it is, with the last
# line that tells a reader something.
logged() { "${@:2}" 2>&1 | to_the_end progress > "$1"; }

progress() {
    local part line='' last='' status=0 begun=$SECONDS next=$((SECONDS + 5))
    local telling='^(Get:[0-9]+ |Unpacking |Setting up |\[ *[0-9]+%\] (Generating|Building) )'
    while ((status == 0 || status > 128)); do # above 128: no whole line came within a second
        IFS= read -r -t 1 part
        status=$?
        line+=$part
        if ((status == 0)); then
            printf '%s\n' "$line"
            [[ ! $line =~ $telling ]] || last=": ${line:0:90}"
            line=''
        fi
        if ((SECONDS >= next)); then
            say "    $((SECONDS - begun)) s$last"
            next=$((SECONDS + 5))
        fi
    done
    printf '%s' "$line"
}
