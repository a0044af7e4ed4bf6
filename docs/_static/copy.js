// A button on each block that copies its commands, without prompts and what they print.
document.addEventListener("DOMContentLoaded", () => {
  for (const block of document.querySelectorAll(".highlight")) {
    const pre = block.querySelector("pre");
    if (!pre) continue;
    const lines = pre.textContent.split("\n");
    const prompts = lines.filter((line) => line.startsWith("$ "));
    const commands = prompts.length > 0 || /^\s*(tautwave|pip|python|\.venv|bash|sudo)\b/.test(lines[0]);
    if (commands) pre.classList.add("wraps");
    for (const line of pre.querySelectorAll(".go")) {
      // What a command prints as a table scrolls: its columns would not survive wrapping.
      if (/\S {2,}\S.* {2,}\S/.test(line.textContent)) line.classList.add("row");
    }
    const button = document.createElement("button");
    button.className = "copy";
    button.type = "button";
    button.textContent = "copy";
    button.onclick = async () => {
      await navigator.clipboard.writeText(copied(lines, prompts.length > 0));
      button.textContent = "copied";
      setTimeout(() => { button.textContent = "copy"; }, 1500);
    };
    block.append(button);
  }
});

// Of a console block the commands, with lines that a backslash continues; else all of it.
function copied(lines, prompted) {
  if (!prompted) return lines.join("\n").trim();
  const kept = [];
  let goes = false;
  for (const line of lines) {
    if (line.startsWith("$ ")) kept.push(line.slice(2));
    else if (goes) kept.push(line);
    else continue;
    goes = line.endsWith("\\");
  }
  return kept.join("\n");
}
