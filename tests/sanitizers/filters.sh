# Sourced: which tests are meant. A test that was renamed must not drop out of a list unnoticed.

# require_tests PROGRAM FILTER: fails, with a sentence, where a pattern of the filter is of no test of the program.
require_tests() {
  local program=$1 patterns pattern lost=0
  IFS=: read -ra patterns <<< "${2%%-*}"  # what comes after is left out, and may be of none
  for pattern in "${patterns[@]}"; do
    [[ $("$program" --gtest_list_tests --gtest_filter="$pattern") == *$'\n  '* ]] && continue
    echo "$program: no test is called $pattern" >&2
    lost=1
  done
  return "$lost"
}
