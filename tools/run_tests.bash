# shellcheck shell=bash
# ./tutorial test. To be sourced by it.

run_tests() {
    local name targets=() all=("$CHECKOUT"/test/*.test) log="$WS/log/test.log" status=0
    for name in "${@%.test}"; do
        [[ -f $CHECKOUT/test/$name.test ]] || die "there is no test/$name.test"
        targets+=("run_tests_actions_tutorial_rostest_test_$name.test")
    done
    # make takes up targets that are named one after the other, and what one target stands for side by side.
    ((${#targets[@]} < ${#all[@]})) || targets=()
    set_up "${RUN[@]}" "${TEST[@]}"
    lock "$WS/build"
    rm -rf "$WS/build/test_results" "$log"
    say 'testing …'
    # numpy, which each node imports, would start a thread for each core.
    export OPENBLAS_NUM_THREADS=1
    run make_tests "${targets[@]-run_tests}" || status=1
    catkin_test_results --all "$WS/build/test_results" >> "$log"
    if ((!$#)); then
        say 'typing the pages …'
        run type_pages || status=1
    fi
    count_tests "$status"
}

# A line for each test as it passes or fails, then what those that failed had to say.
make_tests() {
    local status told='^\[.*\]\[(passed|FAILURE|ERROR)\]|^make.*\*\*\*|^CMake Error|^Cannot find results'
    # cmake once more: it keeps the environment of its first run, which knew no messages yet (ros/catkin#974).
    make_workspace --force-cmake -DCATKIN_ENABLE_TESTING=ON -j4 --output-sync=target "$@" 2>&1 | to_the_end tee "$log" |
        to_the_end sed -nuE "/$told/ { s/^/    /; s/-*\$//p }" >&3
    status=$?
    sed -n '/\]\[\(FAILURE\|ERROR\)\]/,/^---/p; /^\[Testcase:.*!$/,/^SUMMARY/p' "$log" >&3
    return "$status"
}

# Each page counts as a test.
type_pages() {
    local told='s/^.*_test\.py::(.* (PASSED|FAILED|ERROR|SKIPPED)).*/    \1/p; s/^E  /    /p'
    /usr/bin/python3 -m pytest "$CHECKOUT"/checks -k pages_test 2>&1 | to_the_end tee -a "$log" |
        to_the_end sed -nuE "$told" >&3
}

# count_tests STATUS: says the last line; succeeds if STATUS is 0, some tests ran and all passed.
count_tests() {
    local passed failed errors failures end=' +\[ *[0-9]+%\]$'
    passed=$(grep -acE "_test\.py::.* PASSED$end" "$log")
    # Not from the lines above: a rostest that crashes at its end, when all has passed, may lose its own.
    ((passed += $(awk '/^actions_tutorial\/rosunit-/ { n += $2 - $4 - $6 } END { print n + 0 }' "$log")))
    failed=$(grep -acE "_test\.py::.* (FAILED|ERROR)$end" "$log")
    # The summary counts each file as a test, too, but it knows of one that broke off.
    read -r _ _ _ errors _ failures _ <<< "$(grep -a '^Summary: ' "$log")"
    ((failed += errors + failures))
    if (($1 && !failed)); then failed=1; fi # a step that broke off without a count
    if ((failed || !passed)); then say "all that was said is in $log"; fi
    say "$passed passed, $failed failed"
    ((passed && !failed))
}
