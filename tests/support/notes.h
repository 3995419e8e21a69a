// A progress that keeps what a user would be told.
#pragma once

#include <string>
#include <vector>

#include "engine/base/progress.h"

namespace ptc::test {

/// Keeps the notes of a run.
class Notes : public Progress {
 public:
  void note(const std::string& text) override { texts.push_back(text); }
  std::vector<std::string> texts;
};

}  // namespace ptc::test
