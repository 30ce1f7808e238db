# Sourced. Checks test filters, so that a renamed test does not silently drop out of a list.

# require_tests PROGRAM FILTER: fails with a message if a pattern of the filter matches no test of the program.
require_tests() {
  local program=$1 patterns pattern lost=0
  IFS=: read -ra patterns <<< "${2%%-*}"  # patterns after the '-' exclude tests and may match none
  for pattern in "${patterns[@]}"; do
    [[ $("$program" --gtest_list_tests --gtest_filter="$pattern") == *$'\n  '* ]] && continue
    echo "$program: no test is called $pattern" >&2
    lost=1
  done
  return "$lost"
}
