#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

struct sqlite3;
struct sqlite3_stmt;

namespace holdfast {

/// A prepared statement; parameters and columns count from 0. Errors throw JobError.
class SqliteStatement {
 public:
  SqliteStatement& bind(std::int64_t value);
  SqliteStatement& bind(const std::string& value);
  SqliteStatement& bind(std::span<const std::uint8_t> value);
  SqliteStatement& bind_null();
  /// Moves to the next row; false after the last one, and the statement may be bound anew.
  bool step();
  /// For a statement that gives no rows.
  void run();

  std::int64_t integer(int column) const;
  bool is_null(int column) const;
  std::string text(int column) const;
  /// Valid until the next step().
  std::span<const std::uint8_t> bytes(int column) const;

 private:
  friend class SqliteDatabase;
  SqliteStatement(sqlite3* database, const std::string& file, const std::string& sql);
  void check(int result) const;

  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  sqlite3* database_;
  std::string file_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
  int num_bound_ = 0;
};

/// One SQLite file.
class SqliteDatabase {
 public:
  enum class Mode { kRead, kWrite };

  /// kWrite makes the file when it is missing, and keeps every other writer and reader out until it
  /// is closed. Throws JobError when it cannot be opened, is another program's, or is in use.
  SqliteDatabase(const std::string& file, Mode mode);

  SqliteStatement prepare(const std::string& sql);
  void execute(const std::string& sql);
  const std::string& file() const { return file_; }

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };
  std::string file_;
  std::unique_ptr<sqlite3, Close> database_;
};

/// True when the file begins as every SQLite file does.
bool is_sqlite_file(const std::string& file);

}  // namespace holdfast
