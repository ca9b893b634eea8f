#!/bin/sh
# Install what the tests of the operator's page need: Debian's Chromium, where this user may, and axe-core by npm.
here="$(cd "$(dirname "$0")" && pwd)"
"$here/../../firmware/install-debian.sh" page chromium fonts-dejavu-core || exit 1
[ -f "$here/node_modules/axe-core/axe.min.js" ] && exit 0
command -v npm >/dev/null || { echo "page: npm is missing, for axe-core" >&2; exit 1; }
echo "page: installing axe-core ..."
npm ci --silent --no-fund --no-audit --prefix "$here" || { echo "page: npm could not install axe-core" >&2; exit 1; }
