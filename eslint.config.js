// What `make lint` asks of JavaScript. Layout is ESLint's own business: there is no second formatter.

import stylistic from "@stylistic/eslint-plugin";
import globals from "globals";

export default [
  {ignores: [".venv/", "build/", "dist/", "examples/", "docs/"]},
  {
    files: ["**/*.js"],
    plugins: {"@stylistic": stylistic},
    languageOptions: {globals: {...globals.browser}},
    linterOptions: {reportUnusedDisableDirectives: "error"},
    rules: {
      "array-callback-return": "error",
      "complexity": ["error", 20],
      "eqeqeq": "error",
      "max-lines": ["error", 300],
      "max-lines-per-function": ["error", 60],
      "no-async-promise-executor": "error",
      "no-const-assign": "error",
      "no-dupe-keys": "error",
      "no-eval": "error",
      "no-implicit-globals": "error",
      "no-param-reassign": "error",
      "no-promise-executor-return": "off",
      "no-self-assign": "error",
      "no-undef": "error",
      "no-unreachable": "error",
      "no-unused-vars": ["error", {argsIgnorePattern: "^_"}],
      "no-use-before-define": ["error", {functions: false, variables: false}],
      "no-var": "error",
      "prefer-const": ["error", {destructuring: "all"}],
      "@stylistic/arrow-parens": ["error", "as-needed"],
      "@stylistic/comma-dangle": ["error", "only-multiline"],
      "@stylistic/comma-spacing": "error",
      "@stylistic/eol-last": "error",
      "@stylistic/keyword-spacing": "error",
      "@stylistic/max-len": ["error", {code: 118}],
      "@stylistic/no-multi-spaces": "error",
      "@stylistic/no-multiple-empty-lines": ["error", {max: 1}],
      "@stylistic/no-tabs": "error",
      "@stylistic/no-trailing-spaces": "error",
      "@stylistic/quotes": ["error", "double", {avoidEscape: true}],
      "@stylistic/semi": "error",
      "@stylistic/space-infix-ops": "error",
    },
  },
  {files: ["tests/**"], rules: {"max-lines-per-function": "off", "no-use-before-define": "off"}},
];
